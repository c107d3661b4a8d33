"""What a registered executor does: it comes into charge, it runs, it is out of charge."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from msggen.flight.actions import Actions
from msggen.flight.active import ActiveMode
from msggen.flight.executor import Executor
from msggen.flight.mode import Mode
from msggen.flight.registration import Ids


class Charge:
    """An executor with the ids that the vehicle has given."""

    def __init__(
        self,
        executor: Executor,
        ids: Ids,
        actions: Actions,
        find: Callable[[type[Mode] | Mode], ActiveMode],
    ) -> None:
        self.executor, self.ids, self.actions, self.find = executor, ids, actions, find
        self._task: asyncio.Task[None] | None = None
        self._has_run = False
        """Whether it has ended since it came into charge."""
        executor._charge = self  # noqa: SLF001 - its own part

    @property
    def is_in_charge(self) -> bool:
        """Whether `run` is under way."""
        return self._task is not None

    async def fly(self, mode: type[Mode] | Mode) -> None:
        """Fly a mode, and wait for its end."""
        active = self.find(mode)
        flown = active.await_end()
        if active.is_active:
            active.restart()
        else:
            await self.actions.set_mode(active.ids.mode)
        await flown

    def close(self) -> None:
        """End the executor."""
        self._stop()
        self.executor._charge = None  # noqa: SLF001 - as above

    def follow(self, status: Any) -> None:
        """Begin or end with a VehicleStatus."""
        is_armed = status.arming_state == status.ARMING_STATE_ARMED
        is_in_charge = status.executor_in_charge == self.ids.executor
        if not is_in_charge:
            self._stop()
        elif self._task is None and not self._has_run and (is_armed or self.executor.starts != "armed"):
            self._has_run = True
            self._task = asyncio.get_running_loop().create_task(self._run(), name=type(self.executor).__name__)
        if not is_in_charge or (self.executor.starts == "armed" and not is_armed):
            self._has_run = False

    def _stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _run(self) -> None:
        try:
            await self.executor.run()
        except asyncio.CancelledError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever a program raises
            active = self.find(self.executor.mode)
            active.has_failed = True
            context = {"message": f"executor {type(self.executor).__name__} has failed", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)
        finally:
            self._task = None

"""What a flight says: findings with evidence, spectra and responses, and how two flights differ.

Recordings come in, numbers and texts go out; `msggen.exports` draws them. It needs the packages of the extra
`recordings`.
"""

__all__ = [
    "Innovation",
    "Mark",
    "Outputs",
    "Response",
    "Spectrogram",
    "Spectrum",
    "Thrust",
    "actuator_outputs",
    "hover_thrust",
    "innovations",
    "sensor_spectrogram",
    "sensor_spectrum",
    "step_responses",
]

TYPE_CHECKING: bool = False
if TYPE_CHECKING:
    from msggen.analysis.of_logs import (
        actuator_outputs,
        hover_thrust,
        innovations,
        sensor_spectrogram,
        sensor_spectrum,
        step_responses,
    )
    from msggen.analysis.outputs import Innovation, Outputs, Thrust
    from msggen.analysis.response import Response
    from msggen.analysis.spectrum import Mark, Spectrogram, Spectrum
if not TYPE_CHECKING:  # hidden from type checkers, which would accept any attribute of a module that has __getattr__
    _MODULES = {
        "of_logs": (
            "actuator_outputs",
            "hover_thrust",
            "innovations",
            "sensor_spectrogram",
            "sensor_spectrum",
            "step_responses",
        ),
        "outputs": ("Innovation", "Outputs", "Thrust"),
        "response": ("Response",),
        "spectrum": ("Mark", "Spectrogram", "Spectrum"),
    }
    """The public names that each module defines."""

    def __getattr__(name: str) -> object:
        """Return a public name from the module that defines it. Raises AttributeError for any other name."""
        from msggen.base.facade import attribute

        return attribute(__name__, _MODULES, name)

    def __dir__() -> list[str]:
        """Return the names that are imported already, and the public names that can be imported."""
        from msggen.base.facade import names

        return names(__name__, _MODULES)

"""EmPy 3.3 templates, run as EmPy runs them but read only once."""

from msggen.empy.template import EmpyTemplate, importing_from

__all__ = ["EmpyTemplate", "importing_from"]

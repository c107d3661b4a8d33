"""Names of messages. `px4/EscReport` consists of a package and a name."""


def package_resource_name(name: str) -> tuple[str, str]:
    """Return the package, or "" if `name` has none, and the name. Raises ValueError for a second slash."""
    package, _, base = name.rpartition("/")
    if "/" in package:
        raise ValueError(f"'{name}' is not PACKAGE/NAME")
    return package, base

"""Names of messages: `px4/EscReport` is a package and a name."""


def package_resource_name(name: str) -> tuple[str, str]:
    """Return package and name; the package is "" where `name` has none. Raises ValueError for a second slash."""
    package, _, base = name.rpartition("/")
    if "/" in package:
        raise ValueError(f"'{name}' is not PACKAGE/NAME")
    return package, base

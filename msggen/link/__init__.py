"""Links to vehicles over UDP, serial lines and DDS, the tap, and the addresses that name them (docs/links.md)."""

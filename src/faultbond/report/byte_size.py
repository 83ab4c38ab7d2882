"""Numbers of bytes, as people write and read them."""

UNITS = {"TB": 10**12, "GB": 10**9, "MB": 10**6, "kB": 10**3}
GB, MB = UNITS["GB"], UNITS["MB"]


def size_text(size: float) -> str:
    """Give a number of bytes in the unit in which it is a handy number.

    Example
    -------
    >>> size_text(4e9), size_text(2_500_000), size_text(12)
    ('4 GB', '2.5 MB', '12 bytes')
    """
    for name, unit in UNITS.items():
        if size >= unit:
            return f"{size / unit:.3g} {name}"
    return f"{size:.0f} bytes"

"""Numbers in words: one form for each, wherever a label or a tolerance is shown."""

import math

SMALL, LARGE = 1e-3, 1e6


def numeral(value: float, digits: int = 4) -> str:
    """Return a number in short: 1e-9 for a billionth, 0.05, 1.2e7.

    Numbers up to `SMALL` and from `LARGE` on have an exponent, without zeros that say nothing.

    Examples
    --------
    >>> [numeral(value) for value in (1e-3, 2.5e-10, 0.05, 12.0, 0.0)]
    ['1e-3', '2.5e-10', '0.05', '12', '0']
    """
    plain = f"{value:.{digits}g}"
    if value == 0.0 or not math.isfinite(value) or ("e" not in plain and SMALL < abs(value) < LARGE):
        return plain
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").removesuffix(".")
    return f"{mantissa}e{int(exponent)}"

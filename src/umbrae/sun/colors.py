"""Hours as colours."""

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import OptionError

_NAME = "cmocean:thermal"  # perceptually uniform, dark blue in the shade to bright yellow in the sun


def colors(hours: NDArray[np.floating], most: float) -> NDArray[np.float32]:
    """sRGB `(..., 3)` in [0, 1] of hours `(...)`, on a scale from 0 to `most`."""
    try:
        from cmap import Colormap
    except ImportError as error:
        raise OptionError(f"colours of sun hours need cmap: pip install 'umbrae[sun]' ({error})") from error
    table = Colormap(_NAME).lut(256)[:, :3].astype(np.float32)
    share = np.nan_to_num(hours / (most or 1.0))
    shades: NDArray[np.float32] = table[np.clip(np.round(share * 255), 0, 255).astype(np.intp)]
    return shades

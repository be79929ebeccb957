"""Pictures as a clip, through imageio and PyAV, which the extra `video` brings."""

from collections.abc import Iterable
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import OptionError


def write_mp4(stream: BinaryIO, pictures: Iterable[NDArray[np.uint8]], fps: float) -> None:
    """H.264 in an MP4 container; `pictures` are `(h, w, 3)` of one size, both sides even.

    Raises
    ------
    OptionError
        Without imageio and PyAV.
    """
    with imageio().imopen(stream, "w", plugin="pyav", extension=".mp4", container="mp4") as clip:
        clip.init_video_stream("libx264", fps=fps)
        for picture in pictures:
            clip.write_frame(picture)


def imageio() -> Any:
    """The module that writes clips."""
    try:
        import av  # noqa: F401 - imageio tells less clearly what is missing
        import imageio.v3
    except ImportError as error:
        raise OptionError(f"clips need imageio and PyAV: pip install 'umbrae[video]' ({error})") from error
    return imageio.v3

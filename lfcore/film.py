"""Films of pictures, as players want them."""

from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import numpy as np

from lfcore.colour import srgb_codes
from lfcore.files import make_folder, whole_file
from lfcore.storage.segment import named_errors


def write_film(path: Path, pictures: Iterable[np.ndarray], fps: int | Fraction) -> None:
    """An H.264 film (4:2:0, BT.709) of pictures (height, width, 3) of linear light.

    Odd sides are made even by repeating the last line.  The file appears whole or not at all.
    """
    make_folder(path.parent)
    coming = iter(pictures)
    first = next(coming)
    height, width = (side + side % 2 for side in first.shape[:2])
    with whole_file(path) as file, named_errors(path, "encoding the film"):
        with av.open(file, "w", format="mp4") as output:
            stream = output.add_stream("libx264", fps, width=width, height=height)
            stream.pix_fmt = "yuv420p"
            stream.options = {"crf": "16", "preset": "medium"}
            context = stream.codec_context
            context.color_primaries, context.colorspace, context.color_trc = 1, 1, 13
            context.color_range = 1
            for picture in chain([first], coming):
                codes = srgb_codes(picture)
                beside = ((0, height - codes.shape[0]), (0, width - codes.shape[1]), (0, 0))
                codes = np.ascontiguousarray(np.pad(codes, beside, mode="edge"))
                frame = av.VideoFrame.from_ndarray(codes, format="rgb24")
                frame = frame.reformat(
                    format="yuv420p", src_colorspace="ITU709", dst_colorspace="ITU709"
                )
                output.mux(stream.encode(frame))
            output.mux(stream.encode(None))

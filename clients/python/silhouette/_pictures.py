# SPDX-License-Identifier: Apache-2.0
import io

import numpy
import numpy.typing


def decode(png: bytes) -> "numpy.typing.NDArray[numpy.uint8]":
    """A PNG image as an array (height, width, 3), RGB."""
    from PIL import Image  # type: ignore[import]

    return numpy.array(Image.open(io.BytesIO(png)).convert("RGB"))

"""Words as a picture, for viewers that have no letters; the only file that imports Pillow's fonts."""

from __future__ import annotations

import io
import textwrap

from PIL import Image, ImageDraw, ImageFont

SIZE, LEADING, EDGE = 30, 40, 14  # [pixels]
LINE, MOST_LINES = 74, 5  # letters in a line, lines
INK, PAPER = (31, 41, 55), (250, 249, 245)


def lettered(text: str) -> tuple[bytes, float]:
    """A PNG of a text, broken into lines, and its width over its height.

    Examples
    --------
    >>> png, aspect = lettered("All is well.")
    >>> png[1:4], aspect > 10
    (b'PNG', True)
    """
    lines = textwrap.wrap(text, LINE, max_lines=MOST_LINES, placeholder=" ...") or [""]
    font = ImageFont.load_default(SIZE)
    wide = 2 * EDGE + int(max(font.getlength("n" * LINE) * 0.95, *map(font.getlength, lines)))
    tall = 2 * EDGE + LEADING * len(lines)
    image = Image.new("RGB", (wide, tall), PAPER)
    pen = ImageDraw.Draw(image)
    for k, line in enumerate(lines):
        pen.text((EDGE, EDGE + k * LEADING), line, font=font, fill=INK)
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue(), wide / tall

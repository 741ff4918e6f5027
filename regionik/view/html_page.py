"""The page around an offline picture: viewer, drawing commands, legend."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape

from regionik.view.picture import Picture

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} - regionik</title>
<style>
body {{ margin: 0; font: 13px/1.45 system-ui, sans-serif; color: #22272e;
  background: linear-gradient(#ffffff, #d9e1e8) fixed; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#legend {{ position: absolute; left: 16px; top: 16px; padding: 12px 16px; border-radius: 8px;
  background: rgba(255, 255, 255, .88); box-shadow: 0 1px 6px rgba(0, 0, 0, .2); pointer-events: none; }}
#legend h1 {{ margin: 0; font-size: 17px; }}
#legend p {{ margin: 0 0 6px; color: #57606a; max-width: 20em; }}
#legend ul {{ margin: 0; padding: 0; list-style: none; }}
#legend i {{ display: inline-block; width: 12px; height: 12px; margin-right: 8px; border-radius: 3px;
  vertical-align: -1px; }}
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="legend"><h1>{title}</h1><p>{facts}</p><ul>
{legend}
</ul></div>
<!-- Viewer: MeshCat with three.js, both under the MIT licence. -->
<script>{viewer}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of [
{commands}
]) viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
</script>
</body>
</html>
"""


def page(picture: Picture, commands: Iterable[bytes], viewer: str) -> str:
    """One HTML text that needs no other file and no network.

    Parameters
    ----------
    picture : Picture
        For the words; the drawing is in ``commands``.
    commands : iterable of bytes
        Packed commands of the viewer, in order.
    viewer : str
        The viewer's script.
    """
    return _PAGE.format(
        title=escape(picture.title),
        facts=escape(" · ".join(picture.facts)),
        legend="\n".join(
            f'<li><i style="background:#{color:06x}"></i>{escape(words)}</li>'
            for color, words in picture.legend
        ),
        viewer=viewer,
        commands=",\n".join(f'"{base64.b64encode(command).decode("ascii")}"' for command in commands),
    )

"""Pictures as offline HTML pages: viewer, drawing commands, legend."""

from __future__ import annotations

import base64
import os
from html import escape

from regionik.storage.files import write_atomic
from regionik.values import Plan
from regionik.view.picture import Picture
from regionik.view.viewer import packed_commands, picture_of, viewer_script
from regionik.worlds.scene import World

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


def to_html(what: Plan | World | Picture, path: str | os.PathLike[str]) -> None:
    """Write one HTML file that shows a plan, animated, or a world, with no server and no network.

    The same plan gives the same bytes.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    write_atomic(path, html_page(what))


def html_page(what: Plan | World | Picture) -> str:
    """Return the text of that file."""
    picture = picture_of(what)
    legend = (
        f'<li><i style="background:#{color:06x}"></i>{escape(text)}</li>' for color, text in picture.legend
    )
    commands = (base64.b64encode(command).decode("ascii") for command in packed_commands(picture))
    return _PAGE.format(
        title=escape(picture.title),
        facts=escape(" · ".join(picture.facts)),
        legend="\n".join(legend),
        viewer=viewer_script(),
        commands=",\n".join(f'"{command}"' for command in commands),
    )

"""The command ``warm-up``: kernels compiled ahead."""

from __future__ import annotations

import time

from regionik.cli.console import DelayedProgress, print_message
from regionik.worlds.errors import InputError


def warm_up() -> None:
    """Compile the kernels for this machine, so that no later command has to.

    It plans the bundled worlds and asks for their set-points. Without it a kernel is compiled once plain
    Python has worked on it for long. What is done is kept when Ctrl-C ends it.
    """
    from regionik.pipeline import plan
    from regionik.planners.kernels import cache_folder, compiled_at_once
    from regionik.reachability.reach import reach
    from regionik.worlds.bundled import world_names
    from regionik.worlds.documents.world_file import load_world

    if cache_folder() is None:
        raise InputError("compiled kernels can be kept nowhere: set NUMBA_CACHE_DIR to a folder to write")
    names, heard, began = world_names(), list[str](), time.monotonic()
    with DelayedProgress("warm-up", "what is compiled is kept") as progress, compiled_at_once(heard.append):
        for k, name in enumerate(names):
            progress("worlds", k, len(names))
            world = load_world(name)
            plan(world)
            reach(world, world.task)
            seconds = time.monotonic() - began
            print_message(f"{k + 1} of {len(names)}: {name}, {len(heard)} kernels in {seconds:.0f} s")
    print_message(f"kept in {cache_folder()}")

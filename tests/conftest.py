"""Profiles of hypothesis: three in ten of the examples, or with ``--hypothesis-profile=long`` all of them.

No law holds only on a fast machine: neither sets deadlines.
"""

from hypothesis import settings

settings.register_profile("quick", deadline=None, max_examples=30)
settings.register_profile("long", deadline=None, max_examples=100)
settings.load_profile("quick")

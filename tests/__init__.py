"""The tests. No law holds only on a fast machine: hypothesis sets no deadlines."""

from hypothesis import settings

settings.register_profile("regionik", deadline=None)
settings.load_profile("regionik")

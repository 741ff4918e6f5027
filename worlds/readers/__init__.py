"""Foreign files: text, XML, meshes, CSV, maps.

One that cannot be used is an `InputError`: the file, the line where known, and what was expected.
"""

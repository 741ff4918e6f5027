"""Robots from URDF files: the file's elements, the kinematic tree, meshes, collision solids, the base."""

"""A second opinion on plans, from their documents alone: nothing here imports regionik.

Kinematics are pinocchio's, read from an exported URDF; distances in space are coal's, on the floor
shapely's; the way between two states is sampled densely. What samples show is a fact, what they do not
show is not proven: this judge can only contradict, never confirm.
"""

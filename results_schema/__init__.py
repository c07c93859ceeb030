"""The ground floor: what results are called, what they mean, and how they reach the disk whole.

Nothing of ours is imported here, and the package itself imports nothing heavy.
"""

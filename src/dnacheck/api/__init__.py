"""What stands behind the public names of :mod:`dnacheck`: arguments checked, one verb a function.

The table of the names is :data:`dnacheck.PUBLIC`.
"""

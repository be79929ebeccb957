"""Sorting by a short key, in two passes over what is sorted."""

from umbrae.parallel import kernel


@kernel
def sort_by_key(items, keys, shift, out, ends):
    """Write `items`, each a row of `keys`, into `out` in the order of `keys[item] >> shift`; equal ones keep theirs.

    `ends` (zeros, one more than there are shifted keys) tells where they stand: key k in `out[ends[k]:ends[k + 1]]`.
    """
    for item in items:
        ends[(keys[item] >> shift) + 1] += 1
    for key in range(1, len(ends)):
        ends[key] += ends[key - 1]
    place = ends.copy()
    for item in items:
        key = keys[item] >> shift
        out[place[key]] = item
        place[key] += 1

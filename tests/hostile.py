"""Damaged copies of files, as disks, transfers, editors and people with bad intentions make them."""

# What programs stumble over: counts and numbers that are too large, no numbers, and structure.
HOSTILE = [
    b"1e999",
    b"-1",
    b"99999999999999999999",
    b"nan",
    b"1e308",
    b"2147483647",
    b"0",
    b"",
    b"#",
    b"(",
    b")",
    b"[",
    b"{",
    b"'",
]


def broken(good, rng):
    """A damaged copy: cut off, bits or bytes changed, parts doubled, left out or moved, numbers made hostile."""
    content = bytearray(good)
    kind = rng.choice(["cut", "bits", "bytes", "double", "drop", "swap", "numbers", "zeros"])
    at, other = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    if kind == "cut":
        del content[at:]
    elif kind == "bits":
        for _ in range(rng.choice([1, 8, 64])):
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    elif kind == "bytes":
        for _ in range(rng.choice([1, 8, 64])):
            content[rng.randrange(len(content))] = rng.choice(b"#(),;.$*0E'\"[]{}\n\x00\xff")
    elif kind == "double":
        content[at:at] = content[at:other][:2000] * rng.choice([1, 20])
    elif kind == "drop":
        del content[at : at + rng.choice([1, 10, 1000])]
    elif kind == "swap":
        content[at:other] = content[at:other][::-1]
    elif kind == "zeros":
        content[at : at + 64] = b"\0" * 64
    else:
        digits = [i for i, byte in enumerate(content) if chr(byte).isdigit()]
        for _ in range(rng.choice([1, 5])):
            if digits:
                start = stop = min(rng.choice(digits), len(content) - 1)
                while stop < len(content) and chr(content[stop]) in "0123456789.+-eE":
                    stop += 1
                content[start:stop] = rng.choice(HOSTILE)
    return bytes(content)

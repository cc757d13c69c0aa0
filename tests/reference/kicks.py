"""Random kicks as plain as can be: Philox by its definition, and a Brownian path cut in halves."""

import numpy as np

WORD = 2**32


def philox(counter, key):
    """Philox 4 × 32 with ten rounds (Salmon et al. 2011): four words of a counter and a key."""
    for number in range(10):
        a, b, c, d = counter
        first, second = 0xD2511F53 * a, 0xCD9E8D57 * c
        k = (key[0] + number * 0x9E3779B9) % WORD
        other = (key[1] + number * 0xBB67AE85) % WORD
        counter = (second // WORD ^ b ^ k, second % WORD, first // WORD ^ d ^ other, first % WORD)
    return counter


def normals(index, level, body, key):
    """Three standard normal numbers, by Box and Muller."""
    words = philox((index % WORD, index // WORD, level, body), key)
    one, two, three, four = ((word + 0.5) / WORD for word in words)
    radius, turn = np.sqrt(-2 * np.log(one)), 2 * np.pi * two
    other = np.sqrt(-2 * np.log(three)) * np.cos(2 * np.pi * four)
    return np.array([radius * np.cos(turn), radius * np.sin(turn), other])


def increment(kick, level, index, body, key):
    """W of a Brownian motion of unit rate (3,) over the kick of a number at a level [√s].

    Kicks of level 0 last ``kick`` [s], those of each further level half as long. The middle of a
    path of known ends is normal about their mean, with the variance T/4.
    """
    if level == 0:
        return np.sqrt(kick) * normals(index, 0, body, key)
    parent, lasts = index // 2, kick / 2 ** (level - 1)
    whole = increment(kick, level - 1, parent, body, key)
    first = whole / 2 + np.sqrt(lasts / 4) * normals(parent, level, body, key)
    return first if index % 2 == 0 else whole - first

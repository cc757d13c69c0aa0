"""K₀(z) and K₁(z)/z, by which charges in an electrolyte see each other, within 1e-9."""

import math

EULER = 0.5772156649015329

# Below z = 2: 1/(k! (k+1)!), k + 1, and the harmonic number H_k.
SERIES = (
    (1.0, 1.0, 0.0), (0.5, 2.0, 1.0), (1.0 / 12.0, 3.0, 1.5), (1.0 / 144.0, 4.0, 11.0 / 6.0),
    (1.0 / 2880.0, 5.0, 25.0 / 12.0), (1.0 / 86400.0, 6.0, 137.0 / 60.0),
    (1.0 / 3628800.0, 7.0, 49.0 / 20.0), (1.0 / 203212800.0, 8.0, 363.0 / 140.0),
    (1.0 / 14631321600.0, 9.0, 761.0 / 280.0), (1.0 / 1316818944000.0, 10.0, 7129.0 / 2520.0),
)  # fmt: skip

# √z e^z K₀(z) and √z e^z K₁(z) from z = 2 on in powers of 2/z: fitted at Chebyshev nodes.
LARGE = (
    (1.2533141372113017, 1.2533141374358714),
    (-0.07833210681280316, 0.23499636984375394),
    (0.022029757551244873, -0.03671685544964848),
    (-0.011454546191375332, 0.016041297300667053),
    (0.008603361751599913, -0.011086128285228548),
    (-0.00787235110707216, 0.00969849238287851),
    (0.007294077192005892, -0.0087724646921607),
    (-0.0057274232895346035, 0.006801024176912822),
    (0.003275010897498367, -0.003861796984701152),
    (-0.0011602923403642548, 0.0013625930013402396),
    (0.00018755861732605998, -0.0002196952815597351),
)


def bessel_pair(squared):
    """(K₀(z), K₁(z)/z) of z²."""
    if squared < 4.0:
        t = 0.25 * squared
        log, power, zero, first = 0.5 * math.log(t) + EULER, 1.0, 0.0, 0.0
        for factor, next_k, harmonic in SERIES:
            part = factor * power
            zero += next_k * part * (harmonic - log)
            first += part * (log - harmonic - 0.5 / next_k)
            power *= t
        return zero, 1.0 / squared + 0.5 * first
    z = math.sqrt(squared)
    u, zero, first = 2.0 / z, 0.0, 0.0
    for k in range(len(LARGE)):
        of_zero, of_first = LARGE[len(LARGE) - 1 - k]
        zero, first = zero * u + of_zero, first * u + of_first
    fall = math.exp(-z) / math.sqrt(z)
    return zero * fall, first * fall / z

"""What the paper says, claim by claim: the sentences that the claims are read from."""

SENTENCES = {
    1: "abstract: “at least 32 % of equivalent spheres”",
    2: "3.2: “all generated spheropolyflocs had substantially smaller RE”",
    3: "3.2: “RE increased with increasing r in all tests”",
    4: "3.2: “RE … with r_eq > 5 µm decreased with increasing N”",
    5: "5: “achieved an error < 1 %”",
    6: "5: “equivalent spheres always collided within the attraction zone … and resulted in "
    "aggregation”",
    7: "3.3: Type III “Pr[C(d_c < d_0)] = 1 for all N and δ”",
    8: "3.3: “Type I generally showed the lowest …, followed by Type II and III”",
    9: "3.5: “four types of trajectory”",
    10: "3.5: “only Trajectory A and B were observed in Type III”",
    11: "Fig. 7: all four at N = 64, δ = 0",
    12: "3.3: “of Type I and II … decreased with increasing N and also with increasing δ”",
    13: "3.4: “< 1 in all cases … decreased with increasing N and increasing δ”",
    14: "3.4: “Type II … showed the highest”",
    15: "3.4: “> 0 in Type I and II … decreased with increasing N and δ”, in I “always equalled 0 "
    "when δ = δ_max”",
    16: "3.4: outside below inside “in all cases”",
    17: "3.5: D in “approximately 50 % of Type I … increased with increasing N”",
    18: "3.5: A “the most frequent … but … decreased as N increased”",
    19: "abstract: “decreased asymptotically with N …, and decreased further in peri-axial … "
    "collision”",
    20: "abstract: “an error between 0.5 % and 20 %”",
    21: "3.2: “until a minimum was reached at N = 28”",
    22: "3.2: “relatively constant over N”",
    23: "3.3: “r_eq > 5 µm also showed the highest sensitivity to δ”",
    24: "3.4: “Type I and II collisions had relatively similar Pr[A|C(d_c ≥ d_0)]”",
    25: "3.1: “an average … of 6.53 µm and a median at about 5.44 µm”",
    26: "4: “can … be dealt with as a sequence of binary collision”",
}
"""Number → section of the paper, and its words."""

"""The table of all regions of `flocsim fit`, as CSV: flocs with their errors, others with why."""

import csv
import io

COLUMNS = (
    "picture", "floc", "left_out_because", "x_px", "y_px", "area_px", "r_eq_px", "r_eq_m", "blur_px"
)  # fmt: skip


def summary_text(pictures, fits, pixel_size):
    """The table's text: a row per region, then RE [%] for every spheroradius r [px] and N.

    pictures: with name, found (Segmentation) and regions, the fitted ones of found.regions;
    fits: {r: {N: Fit}} of these regions in their order; pixel_size [m].
    """
    radii = list(fits[0]) if fits else []
    pairs = [(radius, count) for radius in radii for count in fits[0][radius]]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*COLUMNS, *(f"re_percent_r{r:g}_N{n}" for r, n in pairs)])
    results = iter(fits)
    for picture in pictures:
        fitted = {region.label: next(results) for region in picture.regions}
        for region in picture.found.regions:
            why = "" if region.label in fitted else "not among the largest"
            row = [picture.name, region.label, why, *_facts(region, pixel_size)]
            errors = [f"{fitted[region.label][r][n].relative_error:.4f}" for r, n in pairs
                      if region.label in fitted]  # fmt: skip
            table.writerow([*row, *(errors or [""] * len(pairs))])
        for region in picture.found.rejected:
            row = [picture.name, "", region.reason, *_facts(region, pixel_size)]
            table.writerow([*row, *[""] * len(pairs)])
    return text.getvalue()


def _facts(region, pixel_size):
    x, y = region.centroid
    radius = region.equivalent_radius
    blur = "" if region.blur != region.blur else f"{region.blur:.2f}"
    return f"{x:.2f}", f"{y:.2f}", region.area, f"{radius:.3f}", f"{radius * pixel_size:.4g}", blur

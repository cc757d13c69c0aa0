"""Motion in the formats of other programs: `vtkhdf` for ParaView, `gsd_file` for OVITO; `outlines`
places the bodies' outlines for both."""

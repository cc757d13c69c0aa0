"""The work behind `flocsim fit`: pictures to fits (`pictures`), the processes that share it
(`processes`), and what is drawn of it over the pictures (`overlays`)."""

"""The work behind `flocsim fit`: pictures to fits (`pictures`), and the processes that share it
(`processes`)."""

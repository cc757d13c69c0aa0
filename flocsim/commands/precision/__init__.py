"""What `flocsim check` and `flocsim work-precision` print: runs against exact ones, ladders."""

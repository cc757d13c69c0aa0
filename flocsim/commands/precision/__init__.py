"""What `flocsim work-precision` is made of: the whole ladder of both methods."""

"""The page of `flocsim report`: replicates to watch (`examples`), their drawing that moves
(`motion`), the HTML (`markup`), and all of it together (`page`)."""

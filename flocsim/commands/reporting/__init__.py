"""The page of `flocsim report`: the drawing of a replicate that moves (`motion`), the HTML
(`markup`), and all of it together (`page`)."""

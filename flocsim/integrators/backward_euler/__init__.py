"""Backward Euler with the contacts of the step's end, for beds whose contacts switch all the time.

``method``: the integrator, and the hand-over from Implicit.  ``step``: one step and its error.
``path``: the search for its end.  ``interior``: the interior-point iteration.  ``newton``: the
semismooth Newton method.  ``contact_mean``: the contact law over a step.  May import ``events``,
``radau`` and ``rhs``.
"""

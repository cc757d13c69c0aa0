"""A trial kind of study: single flocs that settle alone past an upright wall."""

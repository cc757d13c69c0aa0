"""Steps that solve linear forces exactly, as power series of the time, and collocate the rest:
exponential collocation. What a contact does to bodies that hit each other is next to linear."""

"""What the engine knows of pairs of bodies, of a vertex beside an edge, and of contacts there."""

from flocsim.state.records import Record


class ContactState(Record):
    """What a pair that touches, grazes or has just parted carries from step to step."""

    slip_offset: float  # error that ξ was carried with, less that of places along t [m]
    grazing_force: float  # tangential force of a pair that grazes, now [N]
    fresh: float  # 1 where it has only just begun to graze
    grazing_resistance: float  # by how much that force falls with the rate of the gap [N s/m]
    gap_offset: float  # gap at which the pair has been held, which counts as none [m]
    flight: float  # how far the pair has been apart since it last parted [m]
    flights: float  # how often that was next to nothing (events.grazes)
    cycle_slip: float  # ξ at the end of the last cycle of switches (events.cycles) [m]
    cycle_slip_before: float  # ξ at the end of the cycle before [m]
    cycle_gap: float  # gap at the end of the last cycle [m]
    cycle_gap_before: float  # gap at the end of the cycle before [m]
    flown_at: float  # when the pair last touched again after a flight next to nothing [s]
    sampled: float  # its margin (events.crossings) at the last place looked at in a step [m]
    sampled_rate: float  # rate of that margin [m/s]


class InteriorPoint(Record):
    """The unknowns of a contact in backward Euler's interior-point iteration, and its law there.

    All forces are over ``normal_stiffness``, and so are lengths [m].
    """

    overlap: float  # δ, complementary to the slack [m]
    slack: float  # s, what is left of the gap: gap = s − δ [m]
    friction: float  # tangential force as a share of its limit, from −1 to 1
    slide_ahead: float  # how far the pair slides along the tangent [m]
    slide_behind: float  # how far it slides against it [m]
    normal_stiffness: float  # what the other forces are divided by [N/m]
    friction_limit: float  # largest tangential force that friction bears [m]
    stick_force: float  # tangential force if the pair stuck [m]
    stick_slope: float  # derivative of the stick force by the tangential velocity [s]
    held_overlap: float  # overlap by which friction goes from now on; 0: by δ [m]
    step_share: float  # share of the step in which the pair touches
    fading_gap: float  # gap within which that share falls to half as the pair opens [m]


class Candidate(Record):
    """A vertex of one body and an edge of another, which may touch."""

    vertex_body: int
    vertex: int  # its core point
    edge_body: int
    edge_start: int  # first core point of the edge
    edge_end: int  # its last
    closed: int  # how the pair touches in this step, see OPEN
    near: int  # 1 where it may have a share of a surface force in it
    sliding: int  # ±1 where it slides in it, in the direction of ξ, 0 where it sticks
    pair: int  # the row of the two bodies in ``Work.pairs``


# What Candidate.closed says.
(
    OPEN,  # the pair is apart
    TOUCHES,  # it touches, with the whole contact law
    GRAZES,  # borne by a share of it (flocsim.integrators.rhs.friction)
) = range(3)


class BodyPair(Record):
    """Two bodies that may come near each other."""

    later: int  # the body of the larger number
    earlier: int
    acting: int  # 1 where they act on each other in this step


class VertexAtEdge(Record):
    """Where a vertex is beside an edge (flocsim.geometry.contact.points)."""

    normal_x: float  # unit normal from the foot on the edge to the vertex
    normal_y: float
    gap: float  # [m]
    vertex_arm_n: (
        float  # the moment about the vertex's body of a unit force along n, at the middle …
    )
    vertex_arm_t: float  # … of the overlap, and along t [m]
    edge_arm_n: float  # the same about the edge's body [m]
    edge_arm_t: float
    turning: float  # the angle by which n turns for every metre of the vertex along t [1/m]
    foot: float  # how far along the edge the foot lies [m]
    side: float  # ±1 where t goes along the edge or against it
    share: float  # of a surface force, that acts through it


class KeptContact(Record):
    """A pair whose displacement is set aside while the list is made anew."""

    later: int  # the body of the larger number
    earlier: int
    vertex: int  # core point of the vertex
    edge: int  # first core point of the edge
    mode: int  # how the pair touched, see OPEN
    slip: float  # its displacement [m]
    slip_offset: float  # see ContactState
    grazing_force: float
    gap_offset: float
    flights: float

"""Records of candidate pairs (vertex–edge), their contact state, geometry, and pairs of bodies."""

from flocsim.state.records import Record


class ContactState(Record):
    """History that a candidate pair carries from step to step."""

    slip_offset: float  # propagated error of ξ beyond the errors of both positions along t [m]
    grazing_force: float  # tangential force T of a grazing pair in the present state [N]
    newly_grazing: float  # 1 during the first step of grazing
    grazing_resistance: float  # K in T = T₀ − K d(gap)/dt while it grazes [N s/m]
    gap_offset: float  # gap at which a grazing pair is pinned; gaps count from it [m]
    start_gap: float  # gap at the start of the last step [m]
    flight_gap: float  # largest gap since the pair last opened [m]
    short_flights: float  # successive flights far below the tolerance (events.grazes)
    landing_time: float  # time of touching after the last such flight [s]
    sampled_margin: float  # margin (events.crossings) at the last sample in a step [m]
    sampled_margin_rate: float  # its rate of change [m/s]


class InteriorPoint(Record):
    """Unknowns and friction law of a contact in backward Euler's interior-point iteration.

    Forces are divided by ``normal_stiffness``, and are lengths [m] for that. Letters are those of
    flocsim.integrators.backward_euler.interior.
    """

    overlap: float  # δ, complementary to the slack [m]
    slack: float  # s = gap + δ [m]
    friction_ratio: float  # f/L, from −1 to 1
    slip_forward: float  # p, slip along the tangent [m]
    slip_backward: float  # q, slip against the tangent [m]
    normal_stiffness: float  # divides the forces below [N/m]
    friction_limit: float  # L, largest friction; 0: there is no limit, or no friction [m]
    sticking_force: float  # e, friction of a sticking contact [m]
    sticking_slope: float  # derivative of e with respect to the tangential velocity [s]
    closed_fraction: float  # fraction of the step in which the contact is closed
    fade_length: float  # gap in which that fraction falls to half as the contact opens [m]


class Candidate(Record):
    """A vertex of one body and an edge of another that may touch."""

    vertex_body: int  # number of the body
    vertex: int  # its core point, a row of Scene.vertices
    edge_body: int  # number of the body
    edge_start: int  # first core point of the edge
    edge_end: int  # last core point of the edge
    contact_mode: int  # contact mode in this step: OPEN, CLOSED or GRAZING
    surface_active: int  # 1 if it may transmit part of a surface force in this step
    slide_direction: int  # ±1: slides in this step, in the direction of ξ; 0: sticks
    pair: int  # row of the two bodies in ``Work.pairs``
    vertex_radius: float  # spheroradius of the part that the vertex belongs to [m]
    edge_radius: float  # and of that of the edge [m]


# Contact modes (Candidate.contact_mode). A mode is fixed during a step, in which forces are
# therefore smooth.
(
    OPEN,  # no contact force
    CLOSED,  # the whole contact law acts
    GRAZING,  # gap rate zero, part of the tangential force (integrators.rhs.friction)
) = range(3)


class BodyPair(Record):
    """Two bodies that may come near each other."""

    later: int  # the body with the larger number
    earlier: int  # the body with the smaller number
    acting: int  # 1 if they act on each other in this step


class VertexAtEdge(Record):
    """Position of a vertex relative to an edge (flocsim.geometry.contact.points)."""

    normal_x: float  # unit normal n from the foot on the edge to the vertex
    normal_y: float
    gap: float  # distance of the outlines, negative in overlap [m]
    # Moments about the vertex's body of unit forces along n and t at the middle of the overlap.
    vertex_arm_n: float  # [m]
    vertex_arm_t: float  # [m]
    edge_arm_n: float  # the same moments about the edge's body [m]
    edge_arm_t: float
    turning: float  # rotation of n per displacement of the vertex along t [1/m]
    foot: float  # position of the foot along the edge [m]
    side: float  # ±1: t points along the edge or against it
    force_share: float  # share of the surface force that acts through this pair


class SavedContact(Record):
    """A pair whose history is saved while the list is rebuilt."""

    later: int  # the body with the larger number
    earlier: int  # the body with the smaller number
    vertex: int  # core point of the vertex
    edge: int  # first core point of the edge
    mode: int  # contact mode, see OPEN
    slip: float  # ξ [m]
    slip_offset: float  # see ContactState
    grazing_force: float  # see ContactState [N]
    gap_offset: float  # see ContactState [m]
    short_flights: float  # see ContactState

"""A plain, slow, obviously right implementation of the model, independent of flocsim.

It imports nothing from flocsim, so that agreement between the two means something. SI units.

- `outline`: exact area, centroid and inertia of a swept outline.
- `shapes`: `Body`, `make_body`, `Scene`.
- `contacts`: every vertex-edge pair of a scene and its kinematics.
- `forces`: the laws of MODEL section 2 and `loads(scene, laws, displacement)`.
- `integrate`, `motion`: `simulate(scene, laws, duration)`, DOP853 restarted at every event.
- `closed_forms`: roots, terminal velocities and restitution (sections 5 and 7).
- `scenes`: `random_scene(rng)`.
"""

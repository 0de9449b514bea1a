#!/usr/bin/env bash
# Runs `raykiln batch` as a job array of Slurm, for real: a controller and two workers on this machine, without systemd, munge or
# accounting. Kills workers, the controller and the collecting process at random instants, by a seed, and checks that nothing is lost,
# that nothing is baked twice but what was in flight, and that the outputs equal those of a local run.
#
#   tests/pipeline/slurm.sh PROGRAM [ROUNDS [SEED]]
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
rounds=${2:-2} seed=${3:-1}
export SLURM_CONF=$scratch/slurm.conf
controller='' workers=('' '')

write_config() {
  cat >"$SLURM_CONF" <<END
ClusterName=raykiln
SlurmctldHost=localhost
SlurmctldPort=26817
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool-%n
SlurmctldPidFile=$scratch/slurmctld.pid
SlurmdPidFile=$scratch/slurmd-%n.pid
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=1,sched_min_interval=100000
ReturnToService=2
SlurmdTimeout=10
KillWait=1
MinJobAge=3600
NodeName=one,two NodeHostname=$(hostname) NodeAddr=127.0.0.1 Port=[26818-26819] CPUs=1 RealMemory=1000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
  mkdir "$scratch/state"
}

start_controller() {
  slurmctld -D -i >>"$scratch/slurmctld.log" 2>&1 &
  controller=$!
}

# start_worker 0|1
start_worker() {
  local names=(one two)
  slurmd -D -N "${names[$1]}" >>"$scratch/slurmd-${names[$1]}.log" 2>&1 &
  workers[$1]=$!
}

# kill_hard PID: kills a service with all that it started.
kill_hard() {
  local pid=$1 child
  [ -n "$pid" ] || return 0
  for child in $(descendants "$pid"); do kill -KILL "$child" 2>/dev/null; done
  kill -KILL "$pid" 2>/dev/null
  wait "$pid" 2>/dev/null
  return 0
}

descendants() {
  local child
  for child in $(pgrep -P "$1"); do
    descendants "$child"
    echo "$child"
  done
}

# What workers started goes on as a process of its own (slurmstepd): it is found by the configuration that it was given.
steps_of() {
  grep -lzs "^SLURM_CONF=$SLURM_CONF\$" /proc/[0-9]*/environ | cut -d/ -f3 | while read -r pid; do
    case $(cat "/proc/$pid/comm" 2>/dev/null) in slurmstepd | slurm_script | raykiln) echo "$pid" ;; esac
  done
}

stop() {
  kill_hard "${workers[0]}"
  kill_hard "${workers[1]}"
  kill_hard "$controller"
  local pid
  for pid in $(steps_of); do kill -KILL "$pid" 2>/dev/null; done
}

# until_true COMMAND [JOB [TENTHS]]: waits for a command to succeed, a minute at most unless said otherwise.
until_true() {
  local i
  for ((i = 0; i < ${3:-600}; i++)); do
    "$1" ${2:+"$2"} && return
    sleep 0.1
  done
  echo "in vain: $*"
  return 1
}

# A controller that lost its last state may use numbers of jobs again that a worker still knows; Slurm then drains the worker until
# somebody brings it back.
bring_back() {
  sinfo --noheader --Node --format="%N %T" 2>/dev/null | awk '$2 ~ /drain|down/ {print $1}' |
    xargs -r -I{} scontrol update nodename={} state=resume
}

are_up() {
  bring_back
  [ "$(sinfo --noheader --Node --format=%T 2>/dev/null | grep -c -e idle -e alloc -e mixed -e planned -e compl)" -eq 2 ]
}

# A controller that does not answer does not say that a job has ended.
has_ended() {
  local left
  bring_back
  left=$(squeue --noheader --job "$1" 2>&1) || [[ $left == *"Invalid job id"* ]] && ! grep -q "^ *[0-9]" <<<"$left"
}

# ends JOB: waits until a job has ended; one that stays is cancelled, as a person would do: a controller that lost its last state may
# wait for a task that has ended.
ends() {
  until_true has_ended "$1" 200 && return
  in_flight=$((in_flight + 2))
  scancel "$1"
  until_true has_ended "$1"
}

# plan OUT CACHE: writes the job.
plan() {
  raykiln batch "$scratch/assets/**/*.obj" --root "$scratch/assets" --out "$1" --cache "$2" "${FEW_RAYS[@]}" --quiet \
    --plan "$scratch/job.sh" --engine slurm --shards 8 &&
    # The events of each task, to count bakes.
    sed -i "s|--shard |--events \"$1.events-\$SLURM_ARRAY_TASK_ID-\$SLURM_RESTART_COUNT-\$\$.jsonl\" --shard |" "$scratch/job.sh"
}

# bakes OUT: begun and ended bakes, and the most that one asset was baked, by the events.
bakes() {
  python3 - "$1".events-*.jsonl <<'END'
import collections, json, sys
begun, ended = 0, collections.Counter()
for name in sys.argv[1:]:
    # The last line of a task that was killed may be cut off.
    for line in open(name).read().splitlines():
        try:
            event = json.loads(line)
        except ValueError:
            continue
        begun += event["event"] == "start"
        if event["event"] == "done" and event["row"]["status"] == "baked":
            ended[event["row"]["asset"]] += 1
print(begun, sum(ended.values()), max(ended.values()))
END
}

submit() {
  sbatch --parsable --output="$scratch/job.log" --chdir="$scratch" --export=ALL "$@" "$scratch/job.sh"
}

runs_as_an_array() {
  local job
  plan "$scratch/baked" "$scratch/cache" && job=$(submit) && until_true has_ended "$job" &&
    job=$(sbatch --parsable --output="$scratch/job.log" --dependency="afterany:$job" --wrap="sh $scratch/job.sh collect") &&
    until_true has_ended "$job" && cat "$scratch/job.log" && [ "$(counted "$scratch/baked" unchanged)" -eq "$count" ] &&
    same "$scratch/local" "$scratch/baked" && [ "$(bakes "$scratch/baked")" = "$count $count 1" ]
}

# loses_nothing ROUND: kills something at a random instant while a job runs.
loses_nothing() {
  local round=$1 out=$scratch/killed-$1 job
  RANDOM=$((seed * 1000 + round))
  local victim=$((RANDOM % 4)) instant=$((RANDOM % 3000))
  echo "victim $victim after $instant ms"
  # Each of two workers bakes one asset at a time.
  local in_flight=2
  plan "$out" "$scratch/cache-killed-$round" && job=$(submit) || return
  sleep "$(printf '%d.%03d' $((instant / 1000)) $((instant % 1000)))"
  case $victim in
    0 | 1)
      kill_hard "${workers[$victim]}"
      for pid in $(steps_of); do kill -KILL "$pid" 2>/dev/null; done
      start_worker "$victim"
      ;;
    2)
      kill_hard "$controller"
      start_controller
      ;;
    3)
      sh "$scratch/job.sh" collect >/dev/null 2>&1 &
      kill -KILL $! 2>/dev/null
      wait $! 2>/dev/null
      ;;
  esac
  until_true are_up && ends "$job" || return
  # What was killed with its task is run again, as an engine or a person would. A controller that lost its last state may lose the
  # next job, too.
  local tries
  for tries in 1 2 3 4 5; do
    sh "$scratch/job.sh" collect && break
    job=$(submit) && ends "$job" || return
  done
  sh "$scratch/job.sh" collect && [ "$(counted "$out" unchanged)" -eq "$count" ] && same "$scratch/local" "$out" || return
  local begun ended most
  read -r begun ended most < <(bakes "$out")
  echo "bakes: $begun begun, $ended ended, at most $most of one asset; $in_flight may have been in flight"
  [ "$begun" -le $((count + in_flight)) ] && [ "$ended" -ge $((count - in_flight)) ] && [ "$most" -eq 1 ]
}

count=24
assets "$scratch/assets" "$count"
raykiln batch "$scratch/assets/**/*.obj" --root "$scratch/assets" --out "$scratch/local" "${FEW_RAYS[@]}" --quiet || exit
write_config
start_controller
start_worker 0
start_worker 1
case_of "slurm: a controller and two workers start" until_true are_up
[ "$failed" -eq 0 ] || { tail -20 "$scratch"/slurm*.log; finish; }
case_of "slurm: a job array bakes what a local run bakes" runs_as_an_array
for ((round = 0; round < rounds; round++)); do
  case_of "slurm: what is killed loses nothing (seed $seed, round $round)" loses_nothing "$round"
done
finish

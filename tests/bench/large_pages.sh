#!/usr/bin/env bash
# The time of `meshsnap render` with large pages over the time without, in interleaved rounds.
#
#   tests/bench/large_pages.sh MESH [ROUNDS]
set -euo pipefail
mesh="$1"
rounds="${2:-15}"
cd "$(dirname "$0")/../.."
cargo build --release --locked --quiet

picture="$(mktemp --suffix .png)"
trap 'rm -f "$picture"' EXIT
# Prints the hundredths of a millisecond that one picture takes with these tunables.
time_10us() {
  local began ended
  began=$(date +%s%N)
  GLIBC_TUNABLES="$1" target/release/meshsnap render "$mesh" --backend cpu -o "$picture" >/dev/null 2>&1
  ended=$(date +%s%N)
  echo $(((ended - began) / 10000))
}
without=() with=()
for _ in $(seq "$rounds"); do
  without+=("$(time_10us "")")
  with+=("$(time_10us glibc.malloc.hugetlb=1)")
done
median() { printf '%s\n' "$@" | sort -n | sed -n "$((($# + 1) / 2))p"; }
awk -v a="$(median "${without[@]}")" -v b="$(median "${with[@]}")" \
  'BEGIN { printf "without %.1f ms, with %.1f ms, ratio %.2f\n", a / 100, b / 100, b / a }'

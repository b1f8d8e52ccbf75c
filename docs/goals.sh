#!/usr/bin/env bash
# Measures the goals that tests hold, writes them into docs/accuracy.md, and prints its table. Those of the benchmark stay
# (cargo bench --bench accuracy -- --write). MESHSNAP_ORACLE=long takes the long way: millions of edges, all angles.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo test --locked --test suite -- --nocapture accuracy:: golden:: skips:: > "$work/log" 2>&1 || { cat "$work/log"; exit 1; }

# Lines are "goal N: what was measured". Tests end in any order.
grep -oE 'goal [0-9]+: .*' "$work/log" | LC_ALL=C sort -u > "$work/goals"
awk -F '|' '
    FILENAME == ARGV[1] {
        number = $0
        sub(/^goal /, "", number)
        text = number
        sub(/:.*/, "", number)
        sub(/^[0-9]+: /, "", text)
        cell[number] = cell[number] (cell[number] ? "; " : "") text
        next
    }
    # The last cell of a row of the table of goals.
    $2 ~ /^ [0-9]+ $/ && ($2 + 0) in cell { print "|" $2 "|" $3 "|" $4 "| " cell[$2 + 0] ". `docs/goals.sh` |"; next }
    { print }
' "$work/goals" docs/accuracy.md > "$work/page"
cp "$work/page" docs/accuracy.md
grep '^|' docs/accuracy.md

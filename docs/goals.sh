#!/bin/sh
# Measures the goals that tests hold, writes them into docs/accuracy.md, and prints its table. Those of the benchmark stay
# (cargo bench --bench accuracy -- --write). MESHSNAP_ORACLE=long takes the long way: millions of edges, all angles.
set -eu
cd "$(dirname "$0")/.."
log=$(mktemp)
trap 'rm -f "$log"' EXIT
cargo test --locked --test suite -- --nocapture accuracy_ golden:: skips:: > "$log" 2>&1 || { cat "$log"; exit 1; }

# Lines are "goal N: what was measured". Tests end in any order.
grep -oE 'goal [0-9]+: .*' "$log" | LC_ALL=C sort -u | awk -F '|' '
    NR == FNR {
        number = $0
        sub(/^goal /, "", number)
        text = number
        sub(/:.*/, "", number)
        sub(/^[0-9]+: /, "", text)
        cell[number] = cell[number] (cell[number] ? "; " : "") text
        next
    }
    # The last cell of a row of the table of goals.
    $2 ~ /^ [0-9]+ $/ && ($2 + 0) in cell { print "|" $2 "|" $3 "|" $4 "| " cell[$2 + 0] " |"; next }
    { print }
' - docs/accuracy.md > "$log.md"
mv "$log.md" docs/accuracy.md
grep '^|' docs/accuracy.md

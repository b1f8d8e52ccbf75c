#!/bin/sh
# Measures the goals that tests hold, writes them into docs/accuracy.md, and prints its table. Those of the benchmark stay
# (cargo bench --bench accuracy -- --write). MESHSNAP_ORACLE=long takes the long way: millions of edges, all angles.
set -eu
cd "$(dirname "$0")/.."
log=$(mktemp)
trap 'rm -f "$log"' EXIT
cargo test --locked --test suite -- --nocapture accuracy_ golden:: skips:: > "$log" 2>&1 || { cat "$log"; exit 1; }

awk -F '|' '
    # "goal N: what was measured": all of a goal are one cell.
    NR == FNR {
        if (match($0, /goal [0-9]+: /)) {
            split(substr($0, RSTART + 5), parts, ": ")
            text = substr($0, RSTART + RLENGTH)
            if (!(text in seen)) cell[parts[1]] = cell[parts[1]] (cell[parts[1]] ? "; " : "") text
            seen[text] = 1
        }
        next
    }
    # The last cell of a row of the table of goals.
    $2 ~ /^ [0-9]+ $/ && ($2 + 0) in cell { print "|" $2 "|" $3 "|" $4 "| " cell[$2 + 0] " |"; next }
    { print }
' "$log" docs/accuracy.md > "$log.md"
mv "$log.md" docs/accuracy.md
grep '^|' docs/accuracy.md

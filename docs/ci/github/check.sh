#!/usr/bin/env bash
# Checks MESHSNAP_PATHS (one on a line), writes all reports into MESHSNAP_REPORTS, and puts the table into the job's
# summary. Faults of meshes are told by the output `code`; anything else fails the step.
set -euo pipefail

reports=${MESHSNAP_REPORTS:-meshsnap-reports}
mkdir -p -- "$reports"

paths=()
while IFS= read -r line; do
  if [ -n "$line" ]; then paths+=("$line"); fi
done <<< "${MESHSNAP_PATHS:-.}"

words=(--junit "$reports/junit.xml" --sarif "$reports/faults.sarif" --markdown "$reports/comment.md" --html "$reports/page.html")
if [ -n "${MESHSNAP_SINCE:-}" ]; then words+=("--since=$MESHSNAP_SINCE"); fi

code=0
meshsnap check "${words[@]}" -- "${paths[@]}" || code=$?
if [ "$code" -gt 1 ]; then exit "$code"; fi

cat -- "$reports/comment.md" >> "${GITHUB_STEP_SUMMARY:-/dev/stdout}"
echo "code=$code" >> "${GITHUB_OUTPUT:-/dev/stdout}"

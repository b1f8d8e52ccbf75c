#!/usr/bin/env bash
# Takes the pictures of docs/page.md anew, into docs/page/*.png. It takes Chromium, and playwright-core in target/node, which
# tests/run installs.
#
#   docs/page.sh               with target/release/meshsnap
#   docs/page.sh PROGRAM       with another build
set -euo pipefail
cd "$(dirname "$0")/.."

export MESHSNAP_TEST_PROGRAM=${1:-target/release/meshsnap}
export MESHSNAP_TEST_BROWSER=${MESHSNAP_TEST_BROWSER:-$(command -v chromium || command -v google-chrome)}
export MESHSNAP_TEST_TOOLS=$PWD/target/node
node docs/page/tour.mjs

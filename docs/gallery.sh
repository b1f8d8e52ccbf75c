#!/usr/bin/env bash
# Draws the gallery anew: one mesh, every request of api/examples, into docs/gallery/*.webp and docs/gallery.md.
#
#   docs/gallery.sh            on the CPU
#   docs/gallery.sh gpu        the same pictures from the GPU back-end
set -euo pipefail
cd "$(dirname "$0")/.."

backend=${1:-cpu}
size=200
columns=4
# From the plainest look to the ones that look inside.
looks=(
  technical xray ground-shadow smooth flat flat-derivative
  unlit three-point light-direction glow
  transparent wire wire-lit hidden-line
  feature-edges wire-fwidth wire-fwidth-min wire-barycentric
  wire-threshold wireframe wireframe-fwidth boundary
  topology outline-hull outline contour
  materials debug-barycentric debug-min-barycentric debug-edge-distance
  debug-normal debug-uv debug-face-orientation debug-vertex-color
  debug-aspect debug-edge-length debug-curvature debug-uv-stretch
  debug-uv-layout sheet turntable max-error
  clay studio
)
for request in api/examples/*.json; do
  name=$(basename "$request" .json)
  [[ " ${looks[*]} " == *" $name "* ]] || { echo "docs/gallery.sh does not know the example $name" >&2; exit 1; }
done

cargo build --release --quiet
# Nothing that is there changes until all pictures are drawn.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
page=$work/gallery.md
{
  echo "# Every look"
  echo
  echo "One mesh ([lamp.obj](../api/examples/lamp.obj)), every request of [api/examples](../api/examples). Made by [docs/gallery.sh](gallery.sh);"
  echo "the pictures link to their requests."
  echo
  printf '|%s\n|%s\n' "$(printf '  |%.0s' $(seq $columns))" "$(printf -- '---|%.0s' $(seq $columns))"
} > "$page"
row=""
count=0
for name in "${looks[@]}"; do
  target/release/meshsnap render api/examples/lamp.obj -o "$work/$name.webp" \
    --request "api/examples/$name.json" --size $size --backend "$backend" --format webp
  row+="| [![$name](gallery/$name.webp)](../api/examples/$name.json)<br>$name "
  count=$((count + 1))
  if [ $((count % columns)) = 0 ]; then echo "$row|" >> "$page"; row=""; fi
done
[ -z "$row" ] || echo "$row|" >> "$page"
mkdir -p docs/gallery
rm -f docs/gallery/*.webp
mv "$work"/*.webp docs/gallery/
mv "$page" docs/gallery.md
echo "$count pictures, $(du -cb docs/gallery/*.webp | tail -1 | cut -f1) bytes"

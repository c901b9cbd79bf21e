#!/bin/sh
# Fetches the libraries of the live page in the versions of package-lock.json and puts what is served into `three`, and what
# only its tests use into ../tests/axe.
# Run it again after a version was changed; the files are committed, so that a build needs no network.
set -eu
cd "$(dirname "$0")"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp package.json package-lock.json "$scratch"
(cd "$scratch" && npm ci --ignore-scripts --no-audit --no-fund)
three="$scratch/node_modules/three"
mkdir -p three
cp "$three/LICENSE" "$three/build/three.module.min.js" "$three/build/three.core.min.js" three/
# A browser finds no module by the name of its package.
sed "s#from 'three';#from './three.module.min.js';#" "$three/examples/jsm/controls/OrbitControls.js" > three/OrbitControls.js
axe="$scratch/node_modules/axe-core"
mkdir -p ../tests/axe
cp "$axe/LICENSE" "$axe/axe.min.js" ../tests/axe/

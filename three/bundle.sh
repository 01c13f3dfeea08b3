#!/bin/sh
# Bundle the part of three.js that the page of a report needs into the file that is named.
# The versions are exact, so equal packages give equal bytes; a test compares them. The licence
# goes into the bundle, since the bundle goes into every report.
set -eu
output=$(realpath "$1")
cd "$(dirname "$0")"
npm ci --no-audit --no-fund --loglevel=error --prefer-offline
version=$(sed -n 's/^ *"version": "\(.*\)",/\1/p' node_modules/three/package.json)
npx --no-install esbuild entry.js --bundle --minify --charset=ascii --legal-comments=none \
  --format=iife --global-name=THREE --target=es2022 --log-level=warning --outfile="$output" \
  --banner:js="/*! three.js $version

$(cat node_modules/three/LICENSE)
*/"

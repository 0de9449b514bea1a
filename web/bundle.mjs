// npm ci && npm run bundle: makes src/report/html/assets/pane.min.js, with its licence beside it. The bundle is committed,
// so that building Raykiln needs no Node.js.
import { copyFileSync } from 'node:fs';
import { build } from 'esbuild';

const assets = new URL('../src/report/html/assets/', import.meta.url).pathname;
await build({
  entryPoints: [new URL('pane.js', import.meta.url).pathname],
  outfile: `${assets}pane.min.js`,
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  charset: 'ascii',
  legalComments: 'none',
  banner: { js: '/* The 3D pane of Raykiln (web/pane.js), with three.js. Licence of three.js: pane.licence.txt. */' },
});
copyFileSync(new URL('node_modules/three/LICENSE', import.meta.url).pathname, `${assets}pane.licence.txt`);

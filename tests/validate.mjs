// node validate.mjs MODULES FILE...: runs the Khronos glTF validator, installed in the folder MODULES, on each file.
// Prints a line for each error and one for each file; exit status 1 if a file has an error.
import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const ERROR = 0;
const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(path.resolve(modules, 'package.json'))('gltf-validator');

async function errorsOf(file) {
  const beside = (uri) => path.join(path.dirname(file), decodeURIComponent(uri));
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    maxIssues: 0,
    externalResourceFunction: async (uri) => new Uint8Array(await fs.promises.readFile(beside(uri))),
  });
  return report.issues.messages.filter((issue) => issue.severity === ERROR);
}

for (const file of files) {
  const errors = await errorsOf(file);
  for (const { code, pointer, message } of errors) console.log(`${file}: ${code} ${pointer ?? ''}: ${message}`);
  console.log(`${file}: ${errors.length} errors`);
  if (errors.length > 0) process.exitCode = 1;
}

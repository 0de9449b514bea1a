// node validate_sarif.mjs MODULES FILE...: validates each file against the JSON Schema of SARIF 2.1.0 that the package
// @microsoft/jest-sarif, installed in the folder MODULES, contains. Prints a line for each error and one for each file; exit
// status 1 if a file has an error.
import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const [modules, ...files] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, 'package.json'));
const Ajv = require('ajv-draft-04');
const addFormats = require('ajv-formats');

// A pattern of the schema is no regular expression of Unicode mode.
const ajv = new Ajv({ allErrors: true, strict: false, unicodeRegExp: false });
addFormats(ajv);
const schema = JSON.parse(fs.readFileSync(path.join(modules, 'node_modules/@microsoft/jest-sarif/lib/schemas/sarif-2.1.0-rtm.5.json')));
const validate = ajv.compile(schema);

for (const file of files) {
  const valid = validate(JSON.parse(fs.readFileSync(file)));
  const errors = valid ? [] : validate.errors;
  for (const { instancePath, message } of errors) console.log(`${file}: ${instancePath}: ${message}`);
  console.log(`${file}: ${errors.length} errors`);
  if (!valid) process.exitCode = 1;
}

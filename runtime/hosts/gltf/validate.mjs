// The Khronos validator: no error and no warning. node validate.mjs FILE
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

const [file] = process.argv.slice(2);
const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(file)));
for (const { severity, code, message, pointer } of issues.messages) console.log(severity, code, message, pointer ?? "");
console.log(`validator: ${issues.numErrors} errors, ${issues.numWarnings} warnings`);
process.exit(issues.numErrors + issues.numWarnings === 0 ? 0 : 1);

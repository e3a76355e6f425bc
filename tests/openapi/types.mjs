// The document as types of TypeScript: `node types.mjs DOCUMENT` writes them to standard output. Files are blobs.

import { readFileSync } from "node:fs";
import openapiTS, { astToString } from "openapi-typescript";
import ts from "typescript";

const blob = ts.factory.createTypeReferenceNode(ts.factory.createIdentifier("Blob"));
const nodes = await openapiTS(JSON.parse(readFileSync(process.argv[2], "utf8")), {
  transform: (schema) => (schema.format === "binary" ? blob : undefined),
  alphabetize: true,
});
process.stdout.write("// Made from openapi/openapi.json by tests/openapi/run --write; not to be edited.\n\n" + astToString(nodes));

// What the reference uses of Swagger UI, which comes without types.

declare module "*.css";
declare module "swagger-ui-dist/swagger-ui-bundle.js?url" {
  const address: string;
  export default address;
}

interface SwaggerUI {
  preauthorizeApiKey(scheme: string, secret: string): void;
}

declare const SwaggerUIBundle: (options: Record<string, unknown>) => SwaggerUI;

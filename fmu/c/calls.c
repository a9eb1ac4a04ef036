/* What FMI 2.0 and FMI 3.0 call alike. fmi2.c and fmi3.c say how each spells it: FMI(GetVersion) is fmi2GetVersion,
   FMI_STATE(Get, ) is fmi2GetFMUstate; and define Component, report() and the types. */
#define HERE (((Component *)c)->instance)

EXPORT const char *FMI(GetVersion)(void) { return FMI(Version); }
EXPORT Result FMI(SetDebugLogging)(Handle c, Boolean on, size_t n, const String categories[]) {
  return (void)c, (void)on, (void)n, (void)categories, FMI(OK); /* only what goes wrong is ever logged */
}

/* The component with its instance, or NULL: what failed was reported. */
static Handle component_with(Component *c, const char *token, const char *resources) {
  c->instance = instance_new(token, resources, report, c);
  if (c->instance) return c;
  free(c);
  return NULL;
}
EXPORT void FMI(FreeInstance)(Handle c) {
  if (!c) return;
  instance_free(HERE);
  free(c);
}

EXPORT Result FMI(ExitInitializationMode)(Handle c) { return (Result)instance_exit_initialization(HERE); }
EXPORT Result FMI(Terminate)(Handle c) { return (Result)instance_terminate(HERE); }
EXPORT Result FMI(Reset)(Handle c) { return (Result)instance_reset(HERE); }

static Result none_of(Handle c, size_t n, const char *type) {
  return n ? (Result)say(HERE, STATUS_ERROR, "this model has no %s variables", type) : FMI(OK);
}

EXPORT Result FMI_STATE(Get, )(Handle c, Saved *state) { return (Result)instance_save(HERE, state); }
EXPORT Result FMI_STATE(Set, )(Handle c, Saved state) { return (Result)instance_restore(HERE, state); }
EXPORT Result FMI_STATE(Free, )(Handle c, Saved *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return FMI(OK);
}
EXPORT Result FMI_STATE(Serialized, Size)(Handle c, Saved state, size_t *size) {
  (void)c;
  *size = instance_serialised_size(state);
  return *size ? FMI(OK) : FMI(Error);
}
EXPORT Result FMI_STATE(Serialize, )(Handle c, Saved state, Byte bytes[], size_t size) {
  return (Result)instance_serialise(HERE, state, bytes, size);
}
EXPORT Result FMI_STATE(DESERIALIZE, )(Handle c, const Byte bytes[], size_t size, Saved *state) {
  return (Result)instance_deserialise(HERE, bytes, size, state);
}

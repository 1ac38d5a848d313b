/* A function object that draws pictures in any solver of OpenFOAM. In system/controlDict:
 *
 *     functions
 *     {
 *         pictures { type insituPictures; libs (insituPictures); scene "system/pictures.yaml"; fields (p U); }
 *     }
 *
 * It is to be executed at every step, as it is by default, for the mesh tells what changed in the last one alone; the
 * scene says when to draw.
 */
#include <insitu/insitu.h>

#include "addToRunTimeSelectionTable.H"
#include "fvMeshFunctionObject.H"
#include "volFields.H"

using namespace Foam;
static const insitu_type LABEL = sizeof(label) == 4 ? INSITU_INT32 : INSITU_INT64;
static const insitu_type SCALAR = sizeof(scalar) == 4 ? INSITU_FLOAT32 : INSITU_FLOAT64;

struct insituPictures : functionObjects::fvMeshFunctionObject {
    TypeName("insituPictures");
    const wordList fields_;
    insitu_session *session_ = nullptr;

    insituPictures(const word &name, const Time &time, const dictionary &dict)
        : fvMeshFunctionObject(name, time, dict), fields_(dict.get<wordList>("fields"))
    {
        [[gnu::unused]] static const int up = Pstream::parRun() ? 0 : MPI_Init(0, 0) + atexit([] { MPI_Finalize(); });
        report_error(insitu_create(MPI_COMM_WORLD, dict.get<fileName>("scene").c_str(), &session_));
    }

    /* An error of the pictures; the simulation goes on. */
    bool report_error(insitu_status status) const
    {
        return !status || (Warning << insitu_error(session_) << endl, true);
    }

    template <class Type> void setField(const word &name)
    {
        const auto *values = mesh_.findObject<GeometricField<Type, fvPatchField, volMesh>>(name);
        if (!values) return;
        DynamicList<insitu_patch> patches;
        /* Coupled ones, as those between ranks, have cells on both sides. */
        for (const fvPatchField<Type> &p : values->boundaryField())
            patches.append({p.coupled() ? 0 : p.size(), p.patch().start(), {}, 0, {}, {}, {p.cdata(), SCALAR, 0}, 0});
        insitu_field field;
        insitu_field_defaults(&field);
        field.name = name.c_str();
        field.centring = INSITU_CELL;
        field.count = values->size();
        field.component_count = pTraits<Type>::nComponents;
        field.values = {values->cdata(), SCALAR, 0};
        field.patch_count = patches.size();
        field.patches = patches.cdata();
        report_error(insitu_set_field(session_, mesh_.name().c_str(), &field));
    }

    bool execute() override
    {
        insitu_mesh mesh;
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = mesh_.nPoints();
        insitu_mesh_interleaved(&mesh, mesh_.points().cdata(), SCALAR);
        mesh.cell_count = mesh_.nCells();
        mesh.cell_type = INSITU_POLYHEDRON;
        mesh.face_count = mesh_.nFaces();
        /* A face lies in memory as any List does: its size, and last the pointer to its points. */
        mesh.face_sizes = {mesh_.faces().cdata(), LABEL, sizeof(face)};
        mesh.face_lists = {reinterpret_cast<label *const *>(mesh_.faces().cdata() + 1) - 1, LABEL, sizeof(face)};
        mesh.owner = {mesh_.faceOwner().cdata(), LABEL, 0};
        mesh.neighbour_count = mesh_.nInternalFaces();
        mesh.neighbour = {mesh_.faceNeighbour().cdata(), LABEL, 0};
        if (!mesh_.topoChanging()) mesh.changed = mesh_.moving() ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
        report_error(insitu_set_mesh(session_, mesh_.name().c_str(), &mesh));
        for (const word &name : fields_) setField<scalar>(name), setField<vector>(name);
        return report_error(insitu_step(session_, time_.timeIndex(), time_.value()));
    }

    bool write() override { return true; }
    bool end() override { return report_error(insitu_destroy(&session_)); }
};

defineTypeNameAndDebug(insituPictures, 0);
addToRunTimeSelectionTable(functionObject, insituPictures, dictionary);
